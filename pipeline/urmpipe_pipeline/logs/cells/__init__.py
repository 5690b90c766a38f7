"""The cells of a text: numbers, texts, and clocks written as text."""
