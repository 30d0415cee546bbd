"""Policies: what a team does about news."""
