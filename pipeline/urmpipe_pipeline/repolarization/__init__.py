"""The repolarizer over a log: intervals of joints, and the audit of what was undone."""
