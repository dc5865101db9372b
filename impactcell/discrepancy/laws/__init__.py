"""A law that nobody had listed: a free-form term where something remains, then the laws that it may be."""

from impactcell.discrepancy.laws.free_term import FreeTerm, fit_free_terms

__all__ = ["FreeTerm", "fit_free_terms"]
