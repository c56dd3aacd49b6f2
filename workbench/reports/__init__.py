"""A run as one page with its numbers beside it, and a body as a card."""

from workbench.reports.card import card_text, write_card
from workbench.reports.comparison import write_comparison
from workbench.reports.diagnosis import write_design, write_diagnosis
from workbench.reports.folder import refuse_foreign
from workbench.reports.posterior import write_posterior
from workbench.reports.registration import write_registration
from workbench.reports.replays import ReplayPage, show
from workbench.reports.run import write_report

__all__ = [
    "ReplayPage",
    "card_text",
    "refuse_foreign",
    "show",
    "write_card",
    "write_comparison",
    "write_design",
    "write_diagnosis",
    "write_posterior",
    "write_registration",
    "write_report",
]
