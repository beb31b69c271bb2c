"""The page of `./pbrl view`: what is drawn of a bag or a running graph, and the server on this machine's loopback."""
