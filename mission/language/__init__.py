"""The mission file: typed document, YAML loading with line numbers, checks, proof, scenario tests, diagram."""
