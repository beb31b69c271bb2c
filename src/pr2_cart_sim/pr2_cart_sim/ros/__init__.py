"""The nodes of pr2_cart_sim: convert in, call the library, convert out."""
