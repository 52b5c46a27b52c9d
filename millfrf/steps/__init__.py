"""Steps: one public function each, from files or opened data to a result that can be printed, drawn and saved."""
