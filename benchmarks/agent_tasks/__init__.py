"""Tasks that an agent is asked in words, judged by geometry; no model is needed."""
