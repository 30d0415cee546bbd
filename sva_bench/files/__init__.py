"""Files of ours and of others: read and checked at the door, written whole or not at all."""
