"""What ``import sva_bench`` offers, a module for each kind; each is loaded when one of its names is first used."""
