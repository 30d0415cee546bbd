"""The mission: instances, failures, plans and certificates. Knows no world and no solver."""
