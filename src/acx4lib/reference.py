from pathlib import Path
def path(file): return Path('/work/shared/data')/file
