"""FSAI, a factorised sparse approximate inverse of any mask, and a hierarchy of coarser ones."""
