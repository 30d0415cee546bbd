"""The robot: its figures, its path follower, and the follower's kinematic twin."""
