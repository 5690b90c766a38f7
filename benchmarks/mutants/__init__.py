"""The mutation score of the models: a subject a module. mutmut makes the mutants and runs the tests."""
