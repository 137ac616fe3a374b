"""Chapter 15: which flight determines what, before it is flown.

`plans` has the flights, `curves` what they determine along one change at a time, `compared` the
paper's block beside cheaper ones, `explorer` the figure that readers move. Begin with `plans`.
"""
