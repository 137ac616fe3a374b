"""Pages of the book that no notebook makes, and the filling of the book."""
