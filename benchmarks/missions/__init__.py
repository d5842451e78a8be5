"""The paper's six missions: flown, judged by criteria written down beforehand, and measured."""
