"""Execution of jobs in processes of this machine or of a cluster, independent of what the jobs compute."""
