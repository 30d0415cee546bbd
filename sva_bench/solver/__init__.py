"""Plans from instances. Knows no world; whatever it returns is certified elsewhere."""
