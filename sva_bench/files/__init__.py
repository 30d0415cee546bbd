"""Reading and validation of files of any origin, and atomic writing."""
