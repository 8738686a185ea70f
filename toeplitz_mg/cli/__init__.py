"""The command line: one file a subcommand, their arguments, the files that they read and write."""
