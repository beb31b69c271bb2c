"""From a recording's streams to motions on one clock, and windows of them."""
