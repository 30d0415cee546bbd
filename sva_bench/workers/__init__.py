"""Jobs in processes of this machine or of a cluster; nothing here knows what a job is about."""
