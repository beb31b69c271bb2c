"""Proposes a mapping for a foreign bag: which stream could play which role, and why."""

from pbrl_bag.proposing.proposal import Proposal, Proposed, propose
from pbrl_bag.proposing.text import mapping_text

__all__ = ["Proposal", "Proposed", "mapping_text", "propose"]
