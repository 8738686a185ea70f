"""Tangential tractions in friction and rolling."""
