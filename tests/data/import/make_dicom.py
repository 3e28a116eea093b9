"""Writes dicom/: images by pydicom, an independent writer. Oblique planes, slices in no order, two transfer syntaxes.

The stored number of column i, row j, slice k is 100 k + 10 j + i, which a slope of 0.5 and an intercept of -7 rescale.
"""

from pathlib import Path

import numpy as np
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian, MRImageStorage, EnhancedMRImageStorage

FOLDER = Path(__file__).parent / "dicom"
COLUMNS, ROWS, SLICES = 4, 3, 3
ROW = [0.8, 0.6, 0.0]
COLUMN = [0.0, 0.0, -1.0]
NORMAL = np.cross(ROW, COLUMN)
FIRST = np.array([-10.0, 20.0, 5.0])
SPACING = [0.75, 0.5]  # of rows, of columns
DISTANCE = 1.25


def position(k):
    return [f"{x:.6f}" for x in FIRST + DISTANCE * k * NORMAL]


def pixels(k):
    j, i = np.mgrid[0:ROWS, 0:COLUMNS]
    return (100 * k + 10 * j + i).astype("<u2")


def image(name, syntax, storage):
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = storage
    meta.MediaStorageSOPInstanceUID = f"1.2.826.0.1.{abs(sum(map(ord, name)))}"
    meta.TransferSyntaxUID = syntax
    ds = FileDataset(name, {}, file_meta=meta, preamble=b"\0" * 128)
    ds.SOPClassUID, ds.SOPInstanceUID = storage, meta.MediaStorageSOPInstanceUID
    ds.Modality, ds.PatientName = "MR", "Phantom"
    ds.ReferencedImageSequence = Sequence([Dataset()])
    ds.ReferencedImageSequence[0].ReferencedSOPInstanceUID = "1.2.3"
    ds.SamplesPerPixel, ds.PhotometricInterpretation = 1, "MONOCHROME2"
    ds.Rows, ds.Columns = ROWS, COLUMNS
    ds.BitsAllocated, ds.BitsStored, ds.HighBit, ds.PixelRepresentation = 16, 12, 11, 0
    return ds


def single(k):
    ds = image(f"single{k}", ExplicitVRLittleEndian, MRImageStorage)
    ds.ImageType = ["ORIGINAL", "PRIMARY", "P", "ND"]
    ds.SeriesInstanceUID, ds.SeriesNumber, ds.InstanceNumber = "1.2.826.0.1.77", 7, SLICES - k
    ds.SeriesDescription = "displacement encoding"
    ds.ImagePositionPatient, ds.ImageOrientationPatient = position(k), ROW + COLUMN
    ds.PixelSpacing, ds.SliceThickness = SPACING, 1.0
    ds.RescaleSlope, ds.RescaleIntercept = 0.5, -7
    ds.PixelData = pixels(k).tobytes()
    ds.save_as(FOLDER / f"single{(k + 1) % SLICES}.dcm", enforce_file_format=True)


def enhanced():
    ds = image("enhanced", ImplicitVRLittleEndian, EnhancedMRImageStorage)
    ds.SeriesInstanceUID, ds.SeriesNumber, ds.InstanceNumber = "1.2.826.0.1.88", 8, 1
    ds.NumberOfFrames = SLICES

    def sequence(**entries):
        item = Dataset()
        for name, value in entries.items():
            setattr(item, name, value)
        return Sequence([item])

    order = [2, 0, 1]
    frames = []
    for k in order:
        frame = Dataset()
        frame.PlanePositionSequence = sequence(ImagePositionPatient=position(k))
        frame.PixelValueTransformationSequence = sequence(RescaleSlope=0.5, RescaleIntercept=-7, RescaleType="US")
        frame.FrameContentSequence = sequence(InStackPositionNumber=k + 1, StackID="1")
        frames.append(frame)
    ds.PerFrameFunctionalGroupsSequence = Sequence(frames)
    shared = Dataset()
    shared.PlaneOrientationSequence = sequence(ImageOrientationPatient=ROW + COLUMN)
    shared.PixelMeasuresSequence = sequence(PixelSpacing=SPACING, SliceThickness=1.0)
    ds.SharedFunctionalGroupsSequence = Sequence([shared])
    ds.PixelData = b"".join(pixels(k).tobytes() for k in order)
    ds.save_as(FOLDER / "enhanced.dcm", enforce_file_format=True)


FOLDER.mkdir(exist_ok=True)
for slice_number in range(SLICES):
    single(slice_number)
enhanced()
