"""The nodes of krang_sim: convert in, call the library, convert out."""
