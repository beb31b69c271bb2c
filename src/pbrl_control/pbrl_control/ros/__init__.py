"""The nodes of pbrl_control: convert in, call the library, convert out."""
