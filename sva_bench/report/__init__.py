"""Output for people: texts, charts, pictures and pages."""
