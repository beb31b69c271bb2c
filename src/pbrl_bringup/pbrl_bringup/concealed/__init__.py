"""Recordings in which one thing is true and not told, the sealed truth, and how a diagnosis of them is scored."""
