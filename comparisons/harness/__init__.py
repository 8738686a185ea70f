"""How every comparison measures, in processes of its own, and how it reports."""
