from .maps import MapPanel, draw_maps
from .places import MapPlane, map_plane, tip_positions
from .trend_panels import draw_trends

__all__ = ["MapPanel", "MapPlane", "draw_maps", "draw_trends", "map_plane", "tip_positions"]
