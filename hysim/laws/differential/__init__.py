"""Laws that are differential equations in the input: Bouc and Wen's and their relatives, and Duhem's."""
