"""The tables and figures of the paper, drawn anew."""
