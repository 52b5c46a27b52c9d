"""Integration in time: modal structures, joint laws, the regenerative milling loop and its material."""
