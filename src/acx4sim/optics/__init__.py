"""How light goes: refraction in air, the lens, and heads that give the paper's Table 1."""
