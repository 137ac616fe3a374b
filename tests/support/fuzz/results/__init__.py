"""Results that were tampered with or half copied, through every command that reads them."""
