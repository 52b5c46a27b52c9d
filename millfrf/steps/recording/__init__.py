"""Steps that record: acquire, watch, recover, and what a session needs for them."""
