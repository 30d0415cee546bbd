"""Independent answers that the product is checked against: they share no code with it."""
