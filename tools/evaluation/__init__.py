"""Evaluation of detectors on annotated pictures, by COCO's measures.

`dataset` reads annotations of COCO and YOLO, `figures` measures, `errors` draws what
went wrong.
"""
