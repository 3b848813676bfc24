"""Random differences between groups of samples, such as newly prepared terrain, and the estimation of noise from
residuals.
"""
