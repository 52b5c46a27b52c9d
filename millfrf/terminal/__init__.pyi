from .rich_output import as_it_stands, print_table, printable, progress_bar

__all__ = ["as_it_stands", "print_table", "printable", "progress_bar"]
