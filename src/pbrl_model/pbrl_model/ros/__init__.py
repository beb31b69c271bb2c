"""The nodes of pbrl_model: convert in, call the library, convert out."""
