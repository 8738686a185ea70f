"""The command line: one file per subcommand, the arguments, input and output files."""
