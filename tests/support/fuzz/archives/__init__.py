"""Archives that are damaged, lie about themselves, or swell, through the imports that read them."""
