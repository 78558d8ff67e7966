"""Score predictions against bench data, cell by cell and trace by trace."""
