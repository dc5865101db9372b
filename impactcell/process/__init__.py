"""What a program does with its terminal, log, signals, service manager and YAML files."""
