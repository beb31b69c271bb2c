"""What others do about a model that is wrong, given the same recording: they find where, and name no cause."""
