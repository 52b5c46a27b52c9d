"""The live page: a recording drawn in a browser while it grows. What is drawn is thinned out, the file is not."""
