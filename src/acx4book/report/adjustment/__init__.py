"""The adjustments: `groups` of observations, their `tables`, their `residuals` drawn."""
