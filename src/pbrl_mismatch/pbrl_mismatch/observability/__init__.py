"""Which effects a recording could not have shown."""
