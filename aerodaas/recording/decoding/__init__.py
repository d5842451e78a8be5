"""What a stranger wrote becomes checked values: chunks, index, messages, all within bounds."""
