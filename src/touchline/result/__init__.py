# SPDX-License-Identifier: Apache-2.0
"""What Touchline says: contacts and events."""
