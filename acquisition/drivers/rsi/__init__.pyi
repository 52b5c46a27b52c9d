from .rsi_feed import RSI_COUNTS, STANDARD_SIGNALS, RsiFeed, RsiSignal

__all__ = ["RSI_COUNTS", "STANDARD_SIGNALS", "RsiFeed", "RsiSignal"]
