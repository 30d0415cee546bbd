"""Travel times between sites, and the fuel costs made of them."""
