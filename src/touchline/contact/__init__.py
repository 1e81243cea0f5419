# SPDX-License-Identifier: Apache-2.0
"""From residuals to contacts: detection, localization, reaction."""
