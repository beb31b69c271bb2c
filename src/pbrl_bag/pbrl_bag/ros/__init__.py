"""The nodes of pbrl_bag: convert in, call the library, convert out."""
