"""The push that would tell the surviving hypotheses apart."""
