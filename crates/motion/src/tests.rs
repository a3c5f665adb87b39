//! What the plan must hold for any moves, and a few whose answer is known.
