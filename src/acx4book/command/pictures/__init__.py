"""``acx4 measure`` and ``acx4 render``: from pictures to measurements, and to synthetic images."""
