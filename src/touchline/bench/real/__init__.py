# SPDX-License-Identifier: Apache-2.0
"""What holds on recordings of real arms, of which nothing but the model is told."""
