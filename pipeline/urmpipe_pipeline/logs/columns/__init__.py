"""What each column is: joints, rates, tool centre point."""
