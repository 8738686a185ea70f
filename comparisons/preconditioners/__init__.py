"""Every preconditioner on areas and on symbols."""
