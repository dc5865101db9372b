"""What a program does with its terminal, its log, its signals and its service manager."""
