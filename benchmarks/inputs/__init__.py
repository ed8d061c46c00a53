"""Files of others: how fast they are read, and what does not break their readers."""
